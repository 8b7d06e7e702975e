"""Scores of models on suites, and what they are kept in. Reading results needs no torch; `evaluation` does."""
