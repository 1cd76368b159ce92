"""A simulated rig on real endpoints: ptys and TCP ports, in real time, from one loop without threads."""
