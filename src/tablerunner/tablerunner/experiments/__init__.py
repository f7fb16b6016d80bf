"""Published experiments done again: the paper's figures beside ours, raw rows first."""
