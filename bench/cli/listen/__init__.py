"""`bench listen`: what a controller says, without a word to it."""
