"""The HTTP layer of brdfdb."""
