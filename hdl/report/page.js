for (const slider of document.querySelectorAll("input[data-compare]")) {
  const pair = document.getElementById(slider.dataset.compare);
  const show = () => {
    pair.style.setProperty("--at", slider.value + "%");
    slider.setAttribute("aria-valuetext", slider.value + " % of each picture rectified");
  };
  slider.addEventListener("input", show);
  show();
}
