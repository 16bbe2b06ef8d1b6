"""The detector `svm`: HOG and colour features, a linear SVM, windows, a heatmap, votes."""
