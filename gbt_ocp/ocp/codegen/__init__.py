"""From a trajectory problem to C99: generated derivatives, the kernel that solves with them, and the compiler."""
