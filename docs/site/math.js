for (const place of document.querySelectorAll('.math'))
  katex.render(place.textContent, place, {displayMode: place.classList.contains('block'), throwOnError: false});
