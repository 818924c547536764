"""Study of the paper, section by section: every number and equation is computed again and compared with the print."""
