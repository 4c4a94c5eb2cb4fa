"""What people read: results as text and as pages."""
