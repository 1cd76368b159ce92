"""The command line: a composition root. `__main__` declares the commands, the other modules do them."""
