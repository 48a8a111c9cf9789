"""The pages of docs and the site."""
