"""The networks that turn a drawing into a camera grid, and the files that their weights live in."""
