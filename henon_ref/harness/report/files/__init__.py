"""Files of a report: CSV, manifest, figures, locks."""
