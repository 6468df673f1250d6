//! The build of a knee model from a specimen: order, files, command line, report.
