"""Two recorded episodes side by side as a sequence of pictures, 1280 x 720: every part is a pure function of data."""
