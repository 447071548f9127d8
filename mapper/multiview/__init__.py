"""The multi-view mode of Georgakis et al., section III-B: proposals linked into tracks by their 3D centroids."""
