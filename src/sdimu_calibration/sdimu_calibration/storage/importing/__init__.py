"""Files of others (columns in text, MAT, NPZ, bare numbers) made into a bag."""
