"""The pictures of a diagnosis, as an engineer would draw them."""
