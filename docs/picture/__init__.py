"""The picture of the README: a ray-traced motorway, and what the program finds on it.

`light` has colours, noise and the sky, `landscape` the road and what lies beside it, `vehicles`
the shapes of the vehicles, `paint` their materials, `scene` puts all of them together.
"""
