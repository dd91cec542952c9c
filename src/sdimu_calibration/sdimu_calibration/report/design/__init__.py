"""One look for every page: tokens, the sheet and the script made of them, the frame of a page, templates of figures."""
