"""The benchmark: a fixed public set of cases, and the score of anybody's answers."""
