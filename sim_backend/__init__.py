"""The simulated rig: plants and control laws in C, and devices that speak bytes. It knows a truth the bench does not."""
