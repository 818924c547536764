"""The atlas: what each solver makes of a family of ever closer grazes at every tolerance."""
