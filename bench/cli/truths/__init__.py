"""What virtual rigs truly do in procedures of motion, a module for each kind of machine."""
