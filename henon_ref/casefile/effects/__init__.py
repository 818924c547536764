"""Effects: the terms a scene may name, one family a file. What a scene does not name is not in its equations."""
