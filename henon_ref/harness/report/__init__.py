"""Reports: markdown, CSV, figures and manifest, generated from a comparison only."""
