"""Models 1 to 5 of Dressler, Brogårdh and Robertsson 2010: reduced arms, one path for each rod, and measured tracks."""
