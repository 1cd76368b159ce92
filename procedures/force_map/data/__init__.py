"""Published numbers that the tools are shown on; a package so that they install with the code."""
