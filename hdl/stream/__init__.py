"""The hardware around a datapath: from pixels in to pixels out."""
