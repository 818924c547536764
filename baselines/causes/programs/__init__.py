"""Programs in other languages, each a minimal demonstration of a library's behaviour."""
