"""Times of henon and of others, their runs interleaved: for the price list, and over a folder of reports."""
