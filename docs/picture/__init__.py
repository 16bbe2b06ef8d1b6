"""The pictures of the README: a ray-traced motorway, what the program finds on it, and counts.

`light` has colours, noise and the sky, `landscape` the road and what lies beside it, `vehicles`
the shapes of the vehicles, `paint` their materials, `scene` puts all of them together.
`counting` counts on the road of the demo.
"""
