"""The small convolutional network: how it is built, trained and exported. Needs torch."""
