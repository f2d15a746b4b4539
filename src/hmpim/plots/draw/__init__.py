"""Ways to draw a description: SVG, matplotlib, Plotly, each in a room of its own."""
