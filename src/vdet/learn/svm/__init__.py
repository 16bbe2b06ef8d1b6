"""The linear SVM: patches, mining, fitting, and its accuracy on patches."""
