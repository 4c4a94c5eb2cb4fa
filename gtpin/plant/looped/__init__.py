"""Virtual machines whose loops are no rods: a tree of joints, closed at points, with the effects of arms."""
