"""How a library is restarted: every library restarted after its events in each of four ways, on a dozen cases."""
