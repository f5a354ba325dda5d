"""``motorprime bench``: the kernels measured from Python beside the fastest exact ways to do without them."""
