"""Procedures: what is done to the machine, and how a closed recording becomes numbers. One file each."""
