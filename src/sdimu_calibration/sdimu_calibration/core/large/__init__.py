"""Errors of percents: samples corrected exactly, passes about them, until filter and batch agree."""
