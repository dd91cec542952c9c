"""A simulated three-axis rate table: a plan becomes the exact motion of the platform.

Frames: n (North-East-Down at the site), t (platform). The platform's X, Y, Z point North, East and Down
when every axis angle is zero.
"""
