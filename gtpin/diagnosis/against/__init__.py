"""What has changed since an earlier model: a diagnosis whose prior is the posterior of that model."""
