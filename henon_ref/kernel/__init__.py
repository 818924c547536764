"""The compiled part of the reference: its C sources, their compilation, and the loading of the library."""
