"""``gtpin import FORMAT FILE -o DATASET``: one command for each format."""
