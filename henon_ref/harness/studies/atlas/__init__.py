"""The atlas: outcome of each solver at every tolerance over families of grazes of decreasing distance."""
