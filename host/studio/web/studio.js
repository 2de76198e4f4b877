const answer = await fetch('/api/document');
document.getElementById('document').textContent = JSON.stringify(await answer.json(), null, 2);
