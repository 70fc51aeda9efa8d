// The start of the page.

buildHead();
readBlocks().then(buildSections, (error) => tellFailure(error.message));
