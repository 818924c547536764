"""Programs in other languages, each of which shows what a library does by itself."""
