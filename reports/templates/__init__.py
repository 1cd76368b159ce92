"""The pages' templates and style sheet; a package so that they install with the code."""
