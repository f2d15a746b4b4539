"""What the workers do: plain functions of plain values, each a few calls of the package."""
