"""The linear SVM: patches, mining, fitting, and how good a model is on patches."""
