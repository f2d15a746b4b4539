"""Parts that several pages are made of: pictures with cursors, strips, tables."""
