"""The default detector: HOG and colour features, a linear SVM, windows, a heatmap, votes."""
