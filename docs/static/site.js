// For those who read with keys or by ear: what is cut off can be scrolled to, and what is a heading or a link says so.
addEventListener("load", () => {
  for (const box of document.querySelectorAll(".highlight pre, .table-wrapper"))
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
  for (const caption of document.querySelectorAll("p.caption[role=heading]")) caption.ariaLevel = 2;
  for (const link of document.querySelectorAll(".sphx-glr-thumbcontainer a.internal"))
    link.ariaLabel = link.textContent;
});
