"""Figures, tables and pages for people, made from result objects."""
