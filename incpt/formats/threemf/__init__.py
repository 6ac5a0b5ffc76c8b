"""3MF files (3D Manufacturing Format, core specification 1.3), with the colours and images of its materials
extension and the several model parts of its production extension."""
