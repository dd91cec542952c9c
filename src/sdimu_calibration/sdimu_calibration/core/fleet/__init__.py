"""Results of many recordings and units: what a type has in common, who is out, what a data sheet may say.

Everything works on arrays of values and covariances in one unit a coefficient (SI); no room here knows a recording.
"""
