"""Wire formats, pure: bytes to frames and back. Both ends of a link use them."""
