"""Films of two recorded episodes side by side, 1280 x 720 pixels; every part is a pure function of the tapes."""
