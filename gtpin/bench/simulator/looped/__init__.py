"""Virtual machines whose loops are not rods: trees of joints, closed at points, with the effects of arms."""
