"""The explorer, a page in a browser: its modules, and what makes pages of them."""
