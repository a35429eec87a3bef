"""Reports of campaigns and of single runs: one self-contained page, with figures as SVG."""
