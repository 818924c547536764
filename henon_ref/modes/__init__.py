"""The mathematics of modes: fields with signs, sliding, switching, initial-value problems."""
