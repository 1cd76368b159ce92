"""A ball under a magnet, for Levbench: a package from outside its repository, to be copied."""
